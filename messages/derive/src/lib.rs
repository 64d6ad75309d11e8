//! `derive(Message)`: checks a message's layout and emits its schema.

mod emit;
mod parse;

use proc_macro::TokenStream;

/// Makes a struct a message.
#[proc_macro_derive(Message, attributes(message))]
pub fn derive_message(input: TokenStream) -> TokenStream {
    expand(input.into()).into()
}

/// The implementations, or the errors that the compiler shows instead.
fn expand(input: proc_macro2::TokenStream) -> proc_macro2::TokenStream {
    let message = syn::parse2(input).and_then(parse::Message::read);
    message.map_or_else(|error| error.to_compile_error(), |message| emit::emit(&message))
}
